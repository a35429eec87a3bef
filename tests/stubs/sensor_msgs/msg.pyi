class LaserScan:
    angle_min: float
    angle_increment: float
    range_min: float
    range_max: float
    ranges: list[float]
