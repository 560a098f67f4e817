"""Depth of a whole video on disk: lossless maps, the frames they came from, a preview and a line on every frame."""
