"""Path tracing by Blender Cycles, in a Python environment of its own that shares nothing but files with this one."""
