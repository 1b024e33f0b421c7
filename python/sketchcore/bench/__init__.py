"""Our kernels beside what one would otherwise use, on the same data in the same run.

A file for each kind of job says how the best known peers do it (`voxels`, `drawings`, `resampling`, `solids`); `jobs`
puts them side by side, `growth` follows ours as work grows, `timing` and `machine` measure, `present` shows. The peers
are the extra `sketchcore[bench]`; what is not installed is named and left out.
"""

from sketchcore.bench.jobs import Report, bench

__all__ = ["Report", "bench"]
