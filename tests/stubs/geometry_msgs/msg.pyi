class Vector3:
    x: float
    y: float
    z: float

class Twist:
    linear: Vector3
    angular: Vector3
