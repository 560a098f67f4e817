"""The quick start is followed word for word in a clone, from the installation to a depth map.

Only its system packages are taken as installed. `scripts/test_bare_root.py python` installs them, too.
"""

import os
import shutil
import subprocess

import numpy as np
import pytest

from scripts.page_steps import script
from tests.conftest import ROOT

PAGE = ROOT / "docs" / "quick-start.md"
PASSED_ON = ("PATH", "http_proxy", "https_proxy", "no_proxy")
# A compiler cache saves time and changes nothing. Its key holds the compiler's name, a language, and paths from a base.
CACHE = ("CMAKE_CXX_COMPILER_LAUNCHER", "CCACHE_DIR", "CXX", "LANG", "LC_")


def clone(folder):
    """Copy what is tracked, or will be."""
    command = ["git", "ls-files", "--cached", "--others", "--exclude-standard", "-z"]
    names = subprocess.run(command, cwd=ROOT, capture_output=True, text=True, check=True).stdout
    for name in filter(None, names.split("\0")):
        target = folder / name
        target.parent.mkdir(parents=True, exist_ok=True)
        shutil.copy(ROOT / name, target)


@pytest.mark.skipif(not (ROOT / ".git").exists(), reason="needs a checkout: only Git knows what a clone would hold")
def test_a_stranger_gets_a_depth_map(tmp_path):
    checkout = tmp_path / "endosdk"
    clone(checkout)
    packages, _, steps = script(PAGE).partition('Quick start" >&2\n')
    assert "apt-get install" in packages and "make demo" in steps and "apt-get" not in steps
    environment = {key: os.environ[key] for key in os.environ if key in PASSED_ON or key.startswith("PIP_")}
    environment["HOME"] = str(tmp_path)
    if "CCACHE_DIR" in os.environ:
        environment |= {key: os.environ[key] for key in os.environ if key.startswith(CACHE)}
        environment["CCACHE_BASEDIR"] = str(checkout)
    command = ["bash", "-euo", "pipefail", "-c", steps]
    done = subprocess.run(command, cwd=checkout, env=environment, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stdout[-2000:] + done.stderr[-4000:]
    assert "\nOK\n" in done.stdout
    depth = np.load(checkout / "out" / "depth.npy")
    assert depth.shape == (720, 960)
    assert np.isfinite(depth).mean() > 0.5 and 20 < np.nanmedian(depth) < 200
    assert (checkout / "out" / "overview.png").is_file()
