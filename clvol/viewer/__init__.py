"""A scene in the browser: its view, light and density are changed by hand while it renders.

`Subject` is the scene with its knobs, `Wish` what somebody wants to see of it.  One thread renders
(`Painter`), another serves a page (`Server`), whose files are in the folder page/.
"""
