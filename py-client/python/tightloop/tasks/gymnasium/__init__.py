"""gymnasium's MuJoCo tasks v5 under their own names, such as ``tightloop/Ant-v5``."""
