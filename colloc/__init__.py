"""colloc: direct-collocation optimisation of sliding locomotion under Coulomb friction.

Conventions, stated once
------------------------
Units: body length 1, mass 1, period 1 unless a gait states otherwise; forces in units of the weight, so friction
coefficients are forces per weight, work is in weight x length, speeds in lengths per period, angles in radians.

Frames: the *body frame* has the tail at its origin and the tail link along +x. ``(u, v, omega)`` is the velocity of the
tail in that frame. The *lab frame* is fixed; ``theta`` is the angle of the tail link in it.

Order: links and joints are counted from tail to head. Joint angles are the paper's Delta-theta: each link's tangent
angle less that of the link behind it, positive counter-clockwise. Arrays are ``(n_body, n_time)``.

Names: ``s`` arc length, ``t`` time, ``delta`` regularisation speed of friction, ``epsilon`` half-width of the bump of a
concertina crawler, ``mu_t, mu_f, mu_b`` transverse, forward and backward friction coefficient, ``d`` distance per
period, ``W`` work per period against friction, ``efficiency`` = d/W (lambda in the paper).

The paper: S. Alben, "Efficient sliding locomotion with isotropic friction" (2019).
"""
