"""A board as a PNG file that prints in its true size."""

from __future__ import annotations

import struct
import zlib
from pathlib import Path

from endosdk.calibration.boards import Board
from endosdk.errors import InvalidArgument
from endosdk.io.picture_bytes import LONGEST_SIDE
from endosdk.io.whole_files import whole_file

PIXELS_PER_MM = 12  # about 300 per inch
HEADER_END = 33  # bytes of the signature and of the chunk IHDR, behind which pHYs may stand


def print_board(path: Path, board: Board) -> tuple[float, float]:
    """Write the board with its margin of one square, and return the size of the paper that it covers, mm.

    The file states its resolution, so a printer at 100 % gives the sides of the squares.
    """
    import cv2

    side = max(1, round(board.square_mm * PIXELS_PER_MM))  # a square is a whole number of pixels
    longest = (max(board.pattern) + 3) * side
    if longest > LONGEST_SIDE:
        rule = f"must give an image of at most {LONGEST_SIDE} px a side, at {PIXELS_PER_MM} px a millimetre"
        raise InvalidArgument("square_mm", rule, f"{board.square_mm:g}: {longest} px")
    picture = board.picture(side / board.square_mm)
    png = cv2.imencode(".png", picture)[1].tobytes()
    per_metre = round(1000 * side / board.square_mm)
    resolution = b"pHYs" + struct.pack(">IIB", per_metre, per_metre, 1)
    chunk = struct.pack(">I", len(resolution) - 4) + resolution + struct.pack(">I", zlib.crc32(resolution))
    with whole_file(path, "out") as stream:
        stream.write(png[:HEADER_END] + chunk + png[HEADER_END:])
    height, width = picture.shape
    return width * board.square_mm / side, height * board.square_mm / side
