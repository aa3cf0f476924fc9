"""All forms of a material, with their errors and costs."""
