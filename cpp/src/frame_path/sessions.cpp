#include "frame_path/sessions.hpp"

#include <algorithm>

namespace endosdk {

std::shared_ptr<Session> Sessions::of(Size picture) {
  const Size input = padded_size(picture, any_->model());
  const auto found = std::find_if(sized_.begin(), sized_.end(), [&](const Sized& s) { return s.input == input; });
  if (found != sized_.end()) {
    std::rotate(sized_.begin(), found, found + 1);
    return sized_.front().session;
  }
  std::shared_ptr<Session> made = any_->for_size(input);
  if (!made) return any_;
  if (sized_.size() == kept) sized_.pop_back();
  sized_.insert(sized_.begin(), {input, made});
  return made;
}

std::shared_ptr<Session> Sessions::for_one_thread_each(Size picture) {
  if (!one_thread_each_) one_thread_each_ = any_->for_one_thread_each();
  return one_thread_each_ ? one_thread_each_ : of(picture);
}

void Sessions::drop() {
  one_thread_each_.reset();
  sized_.clear();
}

}  // namespace endosdk
