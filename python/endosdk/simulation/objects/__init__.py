"""Scenes that are no anatomy at all: objects of any shape and pattern, anywhere in the rig's range."""
