"""What plugins are made of; no scene and no user.

Arrays of Dr.Jit and parameters of plugins enter; samples, densities and weights leave. Interfaces of our plugins are in
`protocols`; here nothing knows how a scene was described.
"""
