"""Make the networks of the comparisons known to training under their names; importing this module is enough."""

from __future__ import annotations

from benchmarks.methods.anynet import AnyNet
from benchmarks.methods.psmnet import PSMNet
from benchmarks.methods.whole_range import WholeRange
from endosdk.training.networks import NETWORKS

NETWORKS.update({network.name: network for network in (AnyNet, PSMNet, WholeRange)})
