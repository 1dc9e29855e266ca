"""Strain energies, their derivatives, and measured silicones."""
