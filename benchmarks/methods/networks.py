"""Make the rival networks known to training under their names; importing this module is enough."""

from __future__ import annotations

from benchmarks.methods.anynet import AnyNet
from benchmarks.methods.psmnet import PSMNet
from endosdk.training.networks import NETWORKS

NETWORKS.update(anynet=AnyNet, psmnet=PSMNet)
