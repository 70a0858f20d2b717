"""Many runs: which they are, how they are made, what they find."""
