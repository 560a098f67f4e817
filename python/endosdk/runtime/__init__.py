"""The frame path's Python face: model, session, estimator, result, and what a result is written or handed to."""
