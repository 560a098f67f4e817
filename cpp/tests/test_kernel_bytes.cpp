// Runs every kernel on pseudo-random rows. All sets of this processor must give the same bytes. So must other processors:
// compare the printed hashes.
//
//     test_kernel_bytes                      check, and print a hash for each kernel
//     test_kernel_bytes SET KERNEL REPEATS   compute each row REPEATS times, to count the instructions of one kernel
#include <cstdio>
#include <cstdlib>
#include <functional>
#include <string>

#include "check.hpp"
#include "kernel_work.hpp"
#include "kernels/kernels.hpp"

using namespace endosdk;

namespace {

Works all_works() {
  Works works = frame_works();
  works.insert(network_works().begin(), network_works().end());
  return works;
}

std::string hash_of(const char* set, const std::function<void(Output&)>& work) {
  choose_kernels(set);
  draws = Draws();
  Output out;
  work(out);
  return out.hash();
}

}  // namespace

int main(int argc, char** argv) {
  const Works works = all_works();
  if (argc == 4) {
    repeats = std::atoi(argv[3]);
    hash_of(argv[1], works.at(argv[2]));
    return 0;
  }
  for (const auto& [name, work] : works) {
    const std::string expected = hash_of("plain", work);
    std::printf("%s %s\n", name.c_str(), expected.c_str());
    for (int i = 0; kernel_set(i) != nullptr; ++i) {
      const char* set = kernel_set(i);
      if (!rejection([&] { choose_kernels(set); }).empty()) continue;
      const bool same = hash_of(set, work) == expected;
      if (!same) std::fprintf(stderr, "%s differs in %s\n", name.c_str(), set);
      CHECK(same);
    }
  }
  return 0;
}
