"""Read a ROS bag of stereo images, and write one with depth, disparity and points.

python examples/bag_to_depth_bag.py IN.bag RIG OUT.mcap
"""

import sys
from pathlib import Path

import endosdk
from endosdk.live.recording.record import record

bag, rig, out = sys.argv[1:]
estimator = endosdk.DepthEstimator("fast", calibration=endosdk.StereoCalibration.load(rig))
with endosdk.open_source(bag) as source:
    print(record(source, estimator, Path(out)))
