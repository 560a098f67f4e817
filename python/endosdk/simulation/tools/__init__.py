"""Instruments near the lens and what surgeons leave in the picture: shafts, wrists, jaws, needles, thread, gauze."""
