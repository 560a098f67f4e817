#include "geometry/rig_file.hpp"

#include <algorithm>
#include <cmath>
#include <string>
#include <vector>

#include "geometry/rig.hpp"
#include "geometry/rig_rules.hpp"
#include "platform/errors.hpp"
#include "platform/json.hpp"

namespace endosdk {
namespace {

template <typename Rule, typename Value>
void require_readable(bool holds, const std::string& field, const Rule& rule, const Value& value) {
  require(holds, ENDO_CALIBRATION_UNREADABLE, field, rule, value);
}

// The form in which a message shows a text of the file, which may hold any bytes: short and printable.
std::string shown(std::string_view text) {
  constexpr size_t longest = 80;
  std::string seen(text.substr(0, longest));
  std::replace_if(seen.begin(), seen.end(), [](char c) { return c < ' ' || c > '~'; }, '?');
  return text.size() <= longest ? seen : seen + "...";
}

// An object of the file, and its name in messages.
class Fields {
 public:
  Fields(std::string name, std::string_view json) : name_(std::move(name)) {
    const auto found = json_fields(json);
    require_readable(found.has_value(), name_, "must be a JSON object", shown(json));
    fields_ = *found;
    std::vector<std::string_view> names;
    for (const JsonField& field : fields_) names.push_back(field.name);
    std::sort(names.begin(), names.end());
    const auto twin = std::adjacent_find(names.begin(), names.end());
    require_readable(twin == names.end(), name_, "must state each field once", twin == names.end() ? "" : shown(*twin));
  }

  bool has(std::string_view key) const { return find(key) != nullptr; }

  std::string_view value(std::string_view key) const {
    const JsonField* field = find(key);
    require_readable(field != nullptr, title(key), "must be there", "nothing");
    return field->value;
  }

  std::string text(std::string_view key) const {
    const std::string_view json = value(key);
    const auto text = json_value_of_string(json);
    require_readable(text.has_value(), title(key), "must be a plain string", shown(json));
    return std::string(*text);
  }

  // A whole number of 32 bits.
  int32_t whole(std::string_view key) const {
    const std::string_view json = value(key);
    const auto number = json_value_of_number(json);
    const bool fits = number && std::floor(*number) == *number && std::fabs(*number) <= 2147483647.0;
    require_readable(fits, title(key), "must be a whole number", shown(json));
    return static_cast<int32_t>(*number);
  }

  // The numbers of a list, or of a list of lists.
  std::vector<double> numbers(std::string_view key) const {
    std::vector<double> found;
    add_numbers(value(key), title(key), 0, found);
    return found;
  }

  // The same; there must be exactly as many numbers as `out` has.
  template <size_t Count>
  void numbers(std::string_view key, double (&out)[Count]) const {
    const std::vector<double> found = numbers(key);
    require_readable(found.size() == Count, title(key), Text("must hold ", Count, " numbers"), found.size());
    std::copy(found.begin(), found.end(), out);
  }

  std::string title(std::string_view key) const { return name_ == root ? std::string(key) : name_ + " " + std::string(key); }

  static constexpr const char* root = "rig";

 private:
  const JsonField* find(std::string_view key) const {
    const auto found = std::find_if(fields_.begin(), fields_.end(), [&](const JsonField& field) { return field.name == key; });
    return found == fields_.end() ? nullptr : &*found;
  }

  static void add_numbers(std::string_view json, const std::string& title, int depth, std::vector<double>& out) {
    if (const auto number = json_value_of_number(json)) return out.push_back(*number);
    const auto items = json_items(json);
    require_readable(items.has_value() && depth < 2, title, "must hold numbers", shown(json));
    for (const std::string_view item : *items) add_numbers(item, title, depth + 1, out);
  }

  std::string name_;
  std::vector<JsonField> fields_;
};

template <size_t Most>
int32_t read_distortion(const Fields& camera, double (&out)[Most]) {
  const std::vector<double> found = camera.numbers("distortion");
  require_readable(found.size() <= Most, camera.title("distortion"), Text("must hold at most ", Most, " numbers"), found.size());
  std::copy(found.begin(), found.end(), out);
  return static_cast<int32_t>(found.size());
}

void read_camera(const Fields& camera, double (&matrix)[9], double (&distortion)[8], int32_t& count, double (&field)[4]) {
  camera.numbers("matrix", matrix);
  count = read_distortion(camera, distortion);
  if (camera.has("field_of_view") && camera.value("field_of_view") != "null") camera.numbers("field_of_view", field);
}

}  // namespace

endo_calibration read_rig_file(std::string_view text) {
  require_readable(text.size() <= longest_rig_file, Fields::root, Text("must be at most ", longest_rig_file, " bytes"), text.size());
  const Fields file(Fields::root, text);
  require_readable(file.text("format") == rig_file_format, "format", Text("must be ", rig_file_format), shown(file.text("format")));
  require_readable(file.whole("version") == rig_file_version, "version", Text("must be ", rig_file_version), file.whole("version"));
  require_readable(file.text("units") == "mm", "units", "must be mm", shown(file.text("units")));
  const std::string model = file.text("model");
  require_readable(model == "pinhole" || model == "fisheye", "model", "must be pinhole or fisheye", shown(model));
  endo_calibration rig{};
  rig.struct_size = sizeof rig;
  rig.camera_model = model == "fisheye" ? ENDO_FISHEYE : ENDO_PINHOLE;
  rig.width = file.whole("width");
  rig.height = file.whole("height");
  const Fields left("left", file.value("left"));
  const Fields right("right", file.value("right"));
  read_camera(left, rig.left_matrix, rig.left_distortion, rig.left_distortion_count, rig.left_field_of_view);
  read_camera(right, rig.right_matrix, rig.right_distortion, rig.right_distortion_count, rig.right_field_of_view);
  file.numbers("rotation", rig.rotation);
  file.numbers("translation", rig.translation);
  const Rig checked(rig);
  check_plausible_baseline(rig);
  if (file.has("sha256")) {
    const std::string stated = file.text("sha256");
    require_readable(stated == checked.sha256(), "sha256",
                     Text("must be the hash of the content, ", checked.sha256(), "; remove it if the file was edited on purpose"),
                     shown(stated));
  }
  return rig;
}

}  // namespace endosdk
