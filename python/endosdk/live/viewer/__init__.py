"""A page in the browser that shows depth as it is computed; on the loopback address alone."""

from endosdk.live.viewer.player import Player
from endosdk.live.viewer.server import Server

__all__ = ["Player", "Server"]
