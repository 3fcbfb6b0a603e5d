"""This folder does the published study of the RK4 method with a dichotomy again, claim by claim."""
