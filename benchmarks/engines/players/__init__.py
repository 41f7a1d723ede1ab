"""Engines, one a module: ``SETTINGS`` says how it is set, ``DIRECTIONS`` whether its friction may
differ along and across a link, and ``play(task, step)`` gives the tail's x, y [m] and heading and
the motors' work so far [J] at the beginning of each period and after the last, ``(task.periods + 1,
4)``. What it plays is `benchmarks.engines.task.Task`.
"""
