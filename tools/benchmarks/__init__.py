"""What tools/bench.py measures, and with what: scenes, peers, curves, and the tables of its figures."""
