"""Building blocks of the plugins: emission, scattering, faces, guiding, sampling."""
