"""From any source of stereo frames to depth that is watched, recorded and replayed.

The SDK opens no socket. One module is the exception: `endosdk.live.viewer`, which serves its page on the loopback
address alone, and only when ``endosdk view`` or a caller starts it.
"""
