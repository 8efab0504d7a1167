"""From a volume alone to an ordinary scene: what is seen, from where, how dense, in which light.

Everything here makes a scene description, the dict that `clvol.load_dict` takes, and says in a line each what
it chose.  Nothing here renders, and the renderer knows nothing of it.
"""
