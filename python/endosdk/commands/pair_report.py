"""What one stereo pair is worth, in words that a person can act on: its causes, its reasons, and what was measured."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

from endosdk import _core
from endosdk.commands.options import MODEL
from endosdk.commands.report import Report

if TYPE_CHECKING:
    from endosdk.runtime.overview import Picture
    from endosdk.runtime.result import DepthResult


def explain_pair(report: Report, pair: list[Path], calibration: Path | None, bits: int | None) -> list[str]:
    """Say what is wrong with a pair and what to do about it; return what makes it unusable."""
    from endosdk import DepthEstimator, Status, StereoCalibration
    from endosdk.io.pictures import read_frame

    left, right = (read_frame(path, bits=bits) for path in pair)
    rig = StereoCalibration.load(calibration) if calibration else None
    with DepthEstimator(MODEL, calibration=rig) as estimator:
        result = estimator.predict(left, right)
        views = estimator.rectify(left, right)
    report.record["pair"] = {
        "status": result.status.name,
        "valid_share": result.valid_share,
        "causes": {cause.name: measure for cause, measure in result.causes.items()},
        "measures": {cause.name: measure for cause, measure in result.measures.items()},
    }
    _causes(report, result)
    _reasons(report, result)
    matched, words = matched_rows(views)
    report.record["pair"] |= matched
    report.line(f"rows         {words}")
    return [
        f"the pair cannot be used: {_core.cause_facts[cause]['meaning']}"
        for cause, measure in result.causes.items()
        if result.status is Status.INVALID and _is_beyond(measure, _core.cause_facts[cause]["invalid"], cause)
    ]


def _is_beyond(measure: float, limit: float, cause: _core.Cause) -> bool:
    return measure >= limit if _core.cause_facts[cause]["bad"] == "high" else measure < limit


def _causes(report: Report, result: DepthResult) -> None:
    """Say the status and each cause: what it means, what was measured, what to do."""
    report.line(f"pair         status {result.status.name}, {100 * result.valid_share:.1f} % of the pixels are valid")
    for cause, measure in result.causes.items():
        fact = _core.cause_facts[cause]
        report.line(f"cause        {cause.name}: {fact['meaning']}")
        report.line(f"measured     {fact['measure']}: {measure:.3g} ({_limit(cause, result)})")
        report.line(f"             what to do: {fact['remedy']}")
    for cause, measure in result.measures.items():
        if cause not in result.causes:
            report.line(f"measured     {_core.cause_facts[cause]['measure']}: {measure:.3g} ({_limit(cause, result)})")


def _limit(cause: _core.Cause, result: DepthResult) -> str:
    fact = _core.cause_facts[cause]
    limit, seen = fact["degraded"], result.geometry
    if cause is _core.Cause.RIG_MOVED and seen is not None:
        limit = _core.least_turn_deg(seen.focal_px / seen.width)
    return f"{cause.name} {'from' if fact['bad'] == 'high' else 'below'} {limit:.3g}"


def _reasons(report: Report, result: DepthResult) -> None:
    """Say which shares of the pixels are not valid, by their reasons."""
    shares = result.reason_shares
    report.record["pair"]["reasons"] = shares
    named = [f"{name} {100 * share:.1f} %" for name, share in shares.items() if share >= 0.0005]
    report.line(f"reasons      {', '.join(named) or 'none'}")


def matched_rows(views: tuple[Picture, Picture]) -> tuple[dict[str, float | int | None], str]:
    """Return by how much the rows of rectified views differ, and say it. Whether that matters, the causes say."""
    from endosdk.evaluation.vertical_disparity import vertical_disparity

    offset = vertical_disparity(*views)
    record = {"vertical_disparity_px": offset.median_px, "matches": offset.matches}
    if offset.median_px is None:
        return record, f"too few matches to judge ({offset.matches})"
    return record, f"vertical disparity {offset.median_px:.2f} px (median of {offset.matches} matches)"
