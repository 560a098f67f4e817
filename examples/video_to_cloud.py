"""Read a stereo video, and write the points of its last frame as a coloured point cloud: a PLY file in mm.

python examples/video_to_cloud.py VIDEO RIG OUT.ply
"""

import sys

import endosdk
from endosdk.io.point_cloud import write_ply
from endosdk.live.answers import answers

video, rig, out = sys.argv[1:]
estimator = endosdk.DepthEstimator("fast", calibration=endosdk.StereoCalibration.load(rig))
with endosdk.open_source(video) as source:
    for frame, result in answers(estimator, source):
        print(f"frame {frame.number}, {frame.stamp_ns / 1e9:.2f} s: {100 * result.valid_share:.0f} % valid")
left, _ = estimator.rectify(frame.left, frame.right)
print(f"{write_ply(out, result.points(), left)} points in {out}")
