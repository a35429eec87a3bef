class MultiArrayDimension:
    label: str

class MultiArrayLayout:
    dim: list[MultiArrayDimension]

class UInt8MultiArray:
    layout: MultiArrayLayout
    data: bytes
    def __init__(self, *, data: bytes) -> None: ...
