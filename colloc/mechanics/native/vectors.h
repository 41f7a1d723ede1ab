/* Rows of three numbers: a motion (two velocities and a rotation rate), forces and a torque, a point of the plane in their terms. */

#pragma once

typedef double Vector3[3];
typedef Vector3 TwoRows[2];
typedef Vector3 Matrix3[3];
