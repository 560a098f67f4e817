"""The C function of the page about real time, in a program of its own: each thread has what it sets."""

from __future__ import annotations

import shutil
import subprocess
import sys

import pytest

from tests.c_library import binding as c
from tests.conftest import ROOT, TINY_MODEL
from tests.documents.pages import blocks

PROGRAM = """
#include <endosdk/endosdk.h>
#include <stdio.h>

static void set_up_and_tell(void *context, const char *name) {
    set_up_thread(context, name);
    cpu_set_t cores;
    struct sched_param parameters;
    int policy = 0;
    if (sched_getaffinity(0, sizeof cores, &cores) != 0) return;
    if (pthread_getschedparam(pthread_self(), &policy, &parameters) != 0) return;
    printf("%s %d %d %d\\n", name, CPU_COUNT(&cores), policy == SCHED_FIFO, parameters.sched_priority);
}

int main(int argc, char **argv) {
    cpu_set_t cores;
    endo_options options;
    endo_estimator *estimator = NULL;
    endo_stream *stream = NULL;
    if (argc < 3 || sched_getaffinity(0, sizeof cores, &cores) != 0) return 1;
    for (int core = CPU_SETSIZE - 1; CPU_COUNT(&cores) > 1; --core) CPU_CLR(core, &cores);
    endo_options_init(&options, sizeof options);
    options.threads = 2;
    options.runtime_library = argv[2];
    options.thread_started = set_up_and_tell;
    options.thread_context = &cores;
    if (endo_open_file(argv[1], &options, &estimator) != ENDO_OK) return 2;
    if (endo_prepare(estimator, 96, 64) != ENDO_OK) return 3;
    if (endo_stream_open(estimator, 96, 64, NULL, &stream) != ENDO_OK) return 4;
    endo_stream_close(stream);
    endo_close(estimator);
    return 0;
}
"""


def may_be_real_time() -> bool:
    attempt = "import os; os.sched_setscheduler(0, os.SCHED_FIFO, os.sched_param(50))"
    return subprocess.run([sys.executable, "-c", attempt], capture_output=True, check=False).returncode == 0


@pytest.mark.skipif(sys.platform != "linux", reason="the page is about Linux")
def test_the_function_of_the_page_sets_up_each_thread(installed, tmp_path):
    if shutil.which("cc") is None:
        pytest.skip("no C compiler (Debian: apt-get install gcc)")
    (block,) = blocks(ROOT / "docs" / "device" / "real-time.md", "c")
    (tmp_path / "program.c").write_text(block + PROGRAM)
    place = installed.library.parent
    include = f"-I{installed.prefix / 'include'}"
    link = [f"-L{place}", f"-Wl,-rpath,{place}", "-lendosdk", "-pthread"]
    warnings = ["-std=c11", "-Wall", "-Wextra", "-Werror"]
    program = tmp_path / "program"
    command = ["cc", *warnings, include, "-o", program, tmp_path / "program.c", *link]
    subprocess.run(command, check=True)
    run = [program, TINY_MODEL, c.runtime_library()]
    done = subprocess.run(run, check=True, capture_output=True, text=True)
    real = may_be_real_time()
    expected = {"endosdk-session": 50, "endosdk-kernels": 50, "endosdk-stream": 40}
    told = sorted(done.stdout.splitlines())
    names = ["endosdk-kernels", "endosdk-session", "endosdk-stream", "endosdk-stream"]
    assert told == [f"{name} 1 {int(real)} {expected[name] if real else 0}" for name in names]
