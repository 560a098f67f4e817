"""What the shipped models answer to the self test's pair of bands, as the C++ core holds it.

python -m tests.runtime.golden_answers    # writes it anew, after a model has changed; then build again
"""

from __future__ import annotations

from benchmarks.studies.flipped_bits import frame_path
from endosdk.runtime.models import read_model, shipped_models
from endosdk.runtime.session import StereoSession
from tests.conftest import ROOT

FILE = ROOT / "cpp" / "src" / "frame_path" / "golden_answers.cpp"
BEGIN = """// Written by `python -m tests.runtime.golden_answers`.
#include "frame_path/golden_answers.hpp"

#include <algorithm>

namespace endosdk {
namespace {

constexpr GoldenAnswer answers[] = {
"""
END = """};

}  // namespace

const GoldenAnswer* golden_answer(const std::string& model_sha256) {
  const auto* const found = std::find_if(std::begin(answers), std::end(answers), [&](const GoldenAnswer& answer) {
    return model_sha256 == answer.sha256;
  });
  return found != std::end(answers) ? found : nullptr;
}

}  // namespace endosdk
"""


def entry(name: str) -> str:
    """The lines of one shipped model."""
    session = StereoSession(read_model(name))
    cells = frame_path(session).cells_of_answer()
    lines = [f"    // {name}", f'    {{"{session.sha256}",']
    for means, digits, end in zip(cells, (2, 3), (",", "},"), strict=True):
        rows = [", ".join(f"{mean:.{digits}f}f" for mean in row) for row in means]
        lines.append("     {" + ",\n      ".join(rows) + "}" + end)
    return "\n".join(lines) + "\n"


def main() -> None:
    """Write the file."""
    FILE.write_text(BEGIN + "".join(map(entry, shipped_models())) + END)


if __name__ == "__main__":
    main()
