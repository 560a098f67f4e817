"""Pictures, point clouds and serving folders, in and out."""
