"""Measure in one stereo pair: a distance between two pixels and the area inside an outline, with standard errors.

python examples/measure.py LEFT.png RIGHT.png RIG
"""

import sys

import endosdk
from endosdk.io.pictures import read_frame
from endosdk.measure import area, distance, point_at

left, right, rig = sys.argv[1:]
estimator = endosdk.DepthEstimator("fast", calibration=endosdk.StereoCalibration.load(rig))
result = estimator.predict(read_frame(left), read_frame(right))
height, width = result.depth.shape
a, b = (width * 0.44, height * 0.7), (width * 0.65, height * 0.72)  # a person would click
print("depth   ", point_at(result, *a).depth)
print("distance", distance(result, a, b))
outline = [a, (width * 0.65, height * 0.62), b, (width * 0.55, height * 0.8)]
found = area(result, outline)
print("area    ", found.flat)
print("relief  ", found.relief)
