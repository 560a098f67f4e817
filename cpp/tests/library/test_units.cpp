// The small parts that the library has and the kernels have not: SHA-256, JSON, latency histogram.
#include <cmath>
#include <vector>

#include "../check.hpp"
#include "platform/json.hpp"
#include "frame_path/frozen.hpp"
#include "frame_path/latency.hpp"
#include "maps/maps.hpp"
#include "platform/sha256.hpp"

using namespace endosdk;

namespace {

std::string hash(const std::string& text) { return sha256(text.data(), text.size()); }

void sha256_gives_the_published_digests() {
  CHECK(hash("") == "e3b0c44298fc1c149afbf4c8996fb92427ae41e4649b934ca495991b7852b855");
  CHECK(hash("abc") == "ba7816bf8f01cfea414140de5dae2223b00361a396177a9cb410ff61f20015ad");
  CHECK(hash("abcdbcdecdefdefgefghfghighijhijkijkljklmklmnlmnomnopnopq") ==
        "248d6a61d20638b8e5c026930c3e6039a33ce45964ff2167f6ecedd419db06c1");
  CHECK(hash(std::string(1000000, 'a')) == "cdc76e5c9914fb9281a1c7e284d73e67f1809a48a497200e046d39ccc7112cd0");
}

void sha256_pads_at_every_length() {
  // Lengths around the block's end take different ways through the padding; digests of all of them, hashed together.
  std::string digests;
  for (size_t length = 0; length < 130; ++length) digests += hash(std::string(length, 'x'));
  CHECK(hash(digests) == "199af942eba7fa5d1e16d475169eb24018b14e69339c93d26a9ea6d873b4ace6");
}

// A clamped value would read as another one: a surface at 300 px as one at 256 px.
void what_16_bits_cannot_hold_reads_as_no_value() {
  std::vector<float> disparity = {0.0f, 1.0f, 255.99f, 255.999f, 300.0f, 1e30f, -3.0f, no_number, 2.0f};
  std::vector<float> depth(disparity.size(), 6553.5f);
  depth[1] = 6553.6f;
  depth[2] = no_number;
  std::vector<uint8_t> reasons = {0, 0, 0, 0, 0, 0, 0, 0, 1};
  std::vector<uint16_t> steps(disparity.size(), 7);
  std::vector<uint16_t> tenths(disparity.size(), 7);
  write_u16({disparity.data(), nullptr, depth.data(), nullptr, reasons.data(), steps.data(), tenths.data()}, steps.size(), 0.1);
  CHECK((steps == std::vector<uint16_t>{0, 256, 65533, 0, 0, 0, 0, 0, 0}));
  CHECK((tenths == std::vector<uint16_t>{65535, 0, 0, 65535, 65535, 65535, 65535, 65535, 0}));
}

void what_is_sixteen_rows_high_changes_the_print_of_a_picture() {
  constexpr int high = 16;
  constexpr int height = 40;
  for (const int width : {1, 40, 411}) {
    std::vector<uint8_t> pixels(static_cast<size_t>(3 * width * height), 90);
    const ImageView image = {pixels.data(), width, height, 3, ptrdiff_t{3} * width};
    const uint64_t before = print_of(image);
    const auto changes = [&](int y, int rows, int x, int bytes) {
      const auto add = [&](int more) {
        for (int i = 0; i < rows * bytes; ++i) {
          uint8_t& value = pixels[static_cast<size_t>(3 * width * (y + i / bytes) + x + i % bytes)];
          value = static_cast<uint8_t>(value + more);
        }
      };
      add(1);
      const bool changed = print_of(image) != before;
      add(-1);
      return changed;
    };
    for (int y = 0; y + high <= height; y += 3) {
      for (int x = 0; x < 3 * width; x += 31) CHECK(changes(y, high, x, 1));
    }
    if (width > 400) CHECK(changes(3, 1, 30, 1200) && changes(4, 1, 0, 1200));
    CHECK(print_of(image) == before);
  }
}

void json_syntax_is_told_from_other_text() {
  for (const char* text : {"{}", " [1, -2.5e+3, true, null] ", "\"\\u00e9\\n\"", "{\"a\": {\"b\": []}}", "0", "\"\""}) {
    CHECK(is_json(text));
  }
  for (const char* text : {"", "{", "{]", "[1,]", "{\"a\" 1}", "01", "1.", "\"\\x\"", "\"open", "nul", "[] []", "{1: 2}", "-",
                           "\"\\u12g4\"", "\"line\nbreak\""}) {
    CHECK(!is_json(text));
  }
  CHECK(!is_json(std::string(1000000, '[')));  // must not use up the stack
}

void numbers_read_like_pythons() {
  CHECK(json_number(520.5) == "520.5");
  CHECK(json_number(1.0) == "1.0");
  CHECK(json_number(-0.0) == "-0.0");
  CHECK(json_number(0.1) == "0.1");
  CHECK(json_number(1e-4) == "0.0001");
  CHECK(json_number(1e-5) == "1e-05");
  CHECK(json_number(-1.5e-7) == "-1.5e-07");
  CHECK(json_number(1e15) == "1000000000000000.0");
  CHECK(json_number(1e16) == "1e+16");
  CHECK(json_number(5e-324) == "5e-324");
}

void text_is_escaped() {
  CHECK(json_string("a\"b\\c\nd\x01") == "\"a\\\"b\\\\c\\u000ad\\u0001\"");
  CHECK(is_json(json_string("a\"b\\c\nd\x01")));
  CHECK(JsonObject().count("n", 3).number("x", std::nan("")).flag("f", true).done() == "{\"n\":3,\"x\":null,\"f\":true}");
}

void text_that_is_no_utf8_still_makes_json() {
  for (const char* good : {"\u00e9", "\u20ac", "\ud7ff\ue000", "\U0001f52c\U0010ffff"}) {
    CHECK(json_string(good) == '"' + std::string(good) + '"');
  }
  CHECK(json_string("ort\xff.so") == "\"ort\\ufffd.so\"");
  // Cut short, too long a form, half of a pair, beyond the last character: each byte by itself.
  CHECK(json_string("\xe2\x82") == "\"\\ufffd\\ufffd\"");
  CHECK(json_string("\xc0\xaf") == "\"\\ufffd\\ufffd\"");
  CHECK(json_string("\xed\xa0\x80") == "\"\\ufffd\\ufffd\\ufffd\"");
  CHECK(json_string("\xf4\x90\x80\x80") == "\"\\ufffd\\ufffd\\ufffd\\ufffd\"");
  CHECK(json_string("\xe2\"") == "\"\\ufffd\\\"\"");
}

void quantiles_are_close_and_never_below() {
  LatencyHistogram histogram;
  CHECK(histogram.quantile_ms(0.5) == 0.0);
  for (int i = 1; i <= 1000; ++i) histogram.add(0.05 * i);
  for (const double share : {0.5, 0.95, 0.99}) {
    const double truth = 50.0 * share;
    CHECK(histogram.quantile_ms(share) >= truth - 1e-9);
    CHECK(histogram.quantile_ms(share) <= 1.03 * truth);
  }
  CHECK(histogram.quantile_ms(1.0) == 50.0);
  CHECK(histogram.longest_ms() == 50.0);
  histogram.add(0.0);
  histogram.add(1e9);
  CHECK(histogram.count() == 1002);
  CHECK(histogram.longest_ms() == 1e9);
}

}  // namespace

int main() {
  sha256_gives_the_published_digests();
  sha256_pads_at_every_length();
  what_is_sixteen_rows_high_changes_the_print_of_a_picture();
  what_16_bits_cannot_hold_reads_as_no_value();
  json_syntax_is_told_from_other_text();
  numbers_read_like_pythons();
  text_is_escaped();
  text_that_is_no_utf8_still_makes_json();
  quantiles_are_close_and_never_below();
}
