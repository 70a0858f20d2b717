"""What `import snca_ros` offers, one module per subject; nothing else imports them."""
