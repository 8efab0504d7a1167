"""PBRT-v4 scenes (.pbrt) as the nodes that Mitsuba XML turns into, so that everything after is shared.

`tokens` and `parameters` say how a file is written, `directives` what it asks for and in which state, and the
others what that is in Mitsuba's vocabulary.  What has no place there is refused.  What is taken as something
else is said, once.
"""
