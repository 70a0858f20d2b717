"""The functions and classes of `import snca_ros`, one module per subject."""
