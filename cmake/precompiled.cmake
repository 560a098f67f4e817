# Headers of the standard that most sources include. They are parsed once for each target: half of the time of a build
# without optimisation. Sources with flags of their own must skip them. A compiler cache does not keep what is compiled with them, and saves more where it has something.
option(ENDOSDK_PRECOMPILE "Parse the headers of the standard once for each target" OFF)

function(endosdk_precompile target)
  if(ENDOSDK_PRECOMPILE)
    target_precompile_headers(
      ${target}
      PRIVATE
      <algorithm>
      <array>
      <cmath>
      <condition_variable>
      <functional>
      <limits>
      <memory>
      <mutex>
      <optional>
      <sstream>
      <string>
      <string_view>
      <vector>)
  endif()
endfunction()
