// The size at which the network sees a frame when the caller sets none.
#pragma once

#include "images/size.hpp"

namespace endosdk {

// A model with an inference width sees every frame at this width; smaller frames are enlarged. So surfaces have the size and
// the disparities that the model learned from. Other models see frames up to 960 px wide unchanged. Wider frames of the same
// scene have larger disparities, beyond the range of the model, so such a model sees them at a width of 720 px.
// `inference_width` is 0 if the model names none.
Size network_size_of(Size frame, int inference_width);

}  // namespace endosdk
