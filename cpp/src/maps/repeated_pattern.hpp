// Whether the picture repeats itself along its rows, as a chessboard, a mesh or stripes do. Then a match one period away looks
// like the right one, and no network can tell them apart.
#pragma once

#include "maps/patch_search.hpp"

namespace endosdk {

// `search` has taken the views. Share of the patches with texture that correlate nearly as well with a second place of their row, at least five cells from the
// best one. NaN where too few patches can be judged. Of clean pairs, rendered and real, it is at most 0.3.
double share_of_rivals(PatchSearch& search, const MatchedViews& views);

}  // namespace endosdk
