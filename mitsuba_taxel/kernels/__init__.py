"""What plugins are made of: emission, scattering, faces, sampling. No scene and no user."""
