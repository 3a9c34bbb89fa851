class Arm: pass
