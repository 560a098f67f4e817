// What the matches of the network say about a pair that may show one view twice.
#pragma once

#include <vector>

#include "images/size.hpp"
#include "maps/matched_views.hpp"

namespace endosdk {

constexpr int same_view_step = 4;  // matches are looked at in every so many cells along both axes

// The disparity that four fifths of the matches do not exceed, in either direction, in thousandths of the width. Frames that are
// not rectified and show one view have disparity 0 everywhere. `right_shift` is the shift of the right view before the network
// saw it, px of the picture. Infinite where there are too few matches. `apart` is memory for it, which grows with the picture.
double matches_from_one_picture(const MatchedViews& views, Size picture, double right_shift, std::vector<double>& apart);

// Of two copies of one picture, with noise, blur or compression, at least 93 % of the matches were nearer than this. Of pairs with
// overlays, at most 47 % were.
constexpr double one_picture_matches = 4.7;

}  // namespace endosdk
