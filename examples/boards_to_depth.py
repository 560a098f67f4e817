"""Calibrate your endoscope from images of a board, save the rig, and compute the depth of one raw pair.

python examples/boards_to_depth.py BOARDS_LEFT BOARDS_RIGHT COLUMNSxROWS SQUARE_MM LEFT.png RIGHT.png OUT_DIR
"""

import sys
from pathlib import Path

import endosdk
from endosdk.calibration.board import calibrate_views
from endosdk.calibration.board_page import board_page
from endosdk.calibration.boards import Board, find_view
from endosdk.io.picture_pairs import pair_pictures
from endosdk.io.pictures import read_frame
from endosdk.runtime.result_files import write_result

boards_left, boards_right, pattern, square_mm, left, right, out = sys.argv[1:]
columns, rows = map(int, pattern.split("x"))
board = Board((columns, rows), float(square_mm))
views, left_out = [], {}
for paths in pair_pictures(Path(boards_left), Path(boards_right)):
    pair = [read_frame(path) for path in paths]
    view = find_view(board, paths[0].name, *pair)
    if isinstance(view, str):
        left_out[paths[0].name] = view
    else:
        views.append(view)

found = calibrate_views(views, (pair[0].shape[1], pair[0].shape[0]))
print(f"{len(found.views)} views, reprojected to {found.reprojection_px:.2f} px")
for depth, (middle, _) in found.errors.depth_mm.items():
    print(f"depth at {depth:.0f} mm is uncertain by {middle:.2f} mm")
Path(out).mkdir(exist_ok=True)
found.calibration.save(Path(out) / "rig.json")
(Path(out) / "rig.html").write_text(board_page(found, left_out, {}))

estimator = endosdk.DepthEstimator("fast", calibration=found.calibration)
pair = [read_frame(left), read_frame(right)]
result = estimator.predict(*pair)
print(f"depth: {result.status.name}, {100 * result.valid_share:.0f} % of the pixels")
write_result(Path(out) / "depth", estimator.rectify(*pair)[0], result)
