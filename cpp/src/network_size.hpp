// The size at which the network sees a frame when the caller sets none.
#pragma once

#include "rectify.hpp"

namespace endosdk {

// Frames up to 960 px wide are seen as they are: the size the shipped networks are trained on. A wider frame of the same
// scene has larger disparities, which would lie beyond the networks' range; it is seen at a width of 720 px.
Size usual_network_size(Size frame);

}  // namespace endosdk
