"""Rendered endoscopic stereo pairs with exact truth: scenes from seeds, a renderer, a data set writer."""
