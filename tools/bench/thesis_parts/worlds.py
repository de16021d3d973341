"""The two buildings of chapter 5, in sizes like those of the thesis and built in, so that a clone has them.

Drawn as PGM at 0.05 m they take about what the baseline's maps took in table 5-1: 710 kB and 2,671 kB.
"""

SMALL_WORLD = "offices:80:7"
LARGE_WORLD = "offices:320:7"
