"""The drawing app: draw an object, see it in 3D, turn it, and draw over it from another side (paper, section 5).

ink, document               strokes, the drawings they make, parts, and the immutable document of all
session                     a document with undo, and the solid that belongs to it
union, hints                the scene of several parts; how drawings lie
photo                       a picture of a paper sketch as a drawing
sessionfile, store          sessions as files
workers                     reconstructions, fairly, in the background
server, page, launch        the page and what serves it
"""
