"""Many records of one stimulus, fitted together by what they share.

learnt   what the first records tell: the box in which the units lie, and a surface of models
surface  such a surface: an orthonormal basis, and a polynomial that says where on it a model lies
fits     all records fitted at once, in a few numbers each
pole     records that ask for one more pole
fleet    from outputs to figures, with intervals as `identify` gives them
"""
