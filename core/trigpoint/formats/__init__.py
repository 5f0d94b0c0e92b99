"""The formats of point clouds: one module each, behind the door that is `trigpoint.files`.

Each answers ``opened(path)`` with a `Source`, and those that can be written have
``write(path, chunks, plan)``. None of them knows about metres, origins or transformations.
"""
