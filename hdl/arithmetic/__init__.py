"""Numbers and the hardware that computes with them: formats, costs, products, quotients, accumulations."""
