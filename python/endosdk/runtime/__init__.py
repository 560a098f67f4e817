"""The frame path's Python face: model, session, estimator, result."""
