// Width and height of a picture in pixels.
#pragma once

namespace endosdk {

struct Size {
  int width = 0;
  int height = 0;
};

}  // namespace endosdk
