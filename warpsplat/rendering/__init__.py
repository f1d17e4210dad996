"""A scene on a device -> image, and the adjoint; one file a stage, named as its kernel file."""
