// The size at which the network sees a frame when the caller sets none.
#pragma once

#include "images/size.hpp"

namespace endosdk {

// A model that names its inference width sees every frame that wide, smaller ones enlarged: surfaces then have the size and
// the disparities that it learned from. For the others, frames up to 960 px wide are seen as they are; a wider frame of
// the same scene has larger disparities, which would lie beyond their range, and is seen at a width of 720 px.
// `inference_width` is 0 when the model names none.
Size network_size_of(Size frame, int inference_width);

}  // namespace endosdk
