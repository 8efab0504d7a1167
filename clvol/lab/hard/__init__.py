"""Hard cases: scenes on which renderers are known to fail, each with the number that it must show.

A case is described once, and taken from here by the tests in tests/hard, by the page docs/hard-cases.md
(`python tools/docs.py hard`) and by `clvol selftest`.
"""
