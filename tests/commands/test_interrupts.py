"""Ctrl-C stops the program even where Python would only report it and go on, and SIGTERM stops it as politely."""

from __future__ import annotations

import signal
import sys
import time

import pytest

import endosdk.commands.doctor
from endosdk.commands.cli import main
from endosdk.commands.interrupts import interrupts_heard


class InterruptedWhileItEnds:
    def __init__(self, error: type[BaseException]) -> None:
        self.error = error

    def __del__(self) -> None:
        raise self.error


@pytest.mark.usefixtures("interruptible")
def test_an_interrupt_in_a_finaliser_is_raised_again() -> None:
    before = sys.unraisablehook
    with pytest.raises(KeyboardInterrupt), interrupts_heard():
        InterruptedWhileItEnds(KeyboardInterrupt)
        for _ in range(1000):
            time.sleep(0.01)
    assert sys.unraisablehook is before


def test_any_other_error_in_a_finaliser_is_reported_as_before(monkeypatch: pytest.MonkeyPatch) -> None:
    seen: list[type[BaseException]] = []
    monkeypatch.setattr(sys, "unraisablehook", lambda ignored: seen.append(ignored.exc_type))
    with interrupts_heard():
        InterruptedWhileItEnds(ZeroDivisionError)
        time.sleep(0.2)
    assert seen == [ZeroDivisionError]


def test_a_polite_kill_is_an_interrupt_with_a_status_of_its_own(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    def killed(_: object) -> int:
        signal.raise_signal(signal.SIGTERM)
        return 0

    monkeypatch.setattr(endosdk.commands.doctor, "run", killed)
    assert main(["doctor"]) == 143
    assert capsys.readouterr().err == "endosdk doctor: interrupted\n"
    assert signal.getsignal(signal.SIGTERM) == signal.SIG_DFL


def test_a_host_that_answers_the_kill_keeps_its_answer() -> None:
    seen: list[int] = []
    before = signal.signal(signal.SIGTERM, lambda number, _: seen.append(number))
    try:
        with interrupts_heard():
            signal.raise_signal(signal.SIGTERM)
    finally:
        signal.signal(signal.SIGTERM, before)
    assert seen == [signal.SIGTERM]
