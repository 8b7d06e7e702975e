(domain x)
