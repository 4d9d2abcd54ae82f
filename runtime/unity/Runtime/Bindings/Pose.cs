// Poses: for every bone of VRM 1.0 its rotation relative to the T-pose.

using System;
using System.Runtime.InteropServices;
using System.Text;

namespace Kitsuke
{
    /// <summary>A quaternion.</summary>
    [StructLayout(LayoutKind.Sequential)]
    public struct Rotation
    {
        public float X, Y, Z, W;

        public Rotation(float x, float y, float z, float w)
        {
            X = x;
            Y = y;
            Z = z;
            W = w;
        }

        public static Rotation Identity => new Rotation(0, 0, 0, 1);

        /// <summary>First b, then a.</summary>
        public static Rotation operator *(Rotation a, Rotation b) => new Rotation(
            a.W * b.X + a.X * b.W + a.Y * b.Z - a.Z * b.Y,
            a.W * b.Y - a.X * b.Z + a.Y * b.W + a.Z * b.X,
            a.W * b.Z + a.X * b.Y - a.Y * b.X + a.Z * b.W,
            a.W * b.W - a.X * b.X - a.Y * b.Y - a.Z * b.Z);

        /// <summary>The way back, of a unit quaternion.</summary>
        public Rotation Inverse => new Rotation(-X, -Y, -Z, W);
    }

    /// <summary>A place or a way, in the axes of the call.</summary>
    [StructLayout(LayoutKind.Sequential)]
    public struct Place
    {
        public float X, Y, Z;

        public Place(float x, float y, float z)
        {
            X = x;
            Y = y;
            Z = z;
        }
    }

    /// <summary>For every bone the rotation relative to the T-pose in its parent's axes, which in the T-pose are the model's, and how
    /// far the hips have moved from where they rest. What is no rotation counts as the T-pose, so that <c>new Pose()</c> is it.</summary>
    [StructLayout(LayoutKind.Sequential)]
    public unsafe struct Pose
    {
        private fixed float rotations[4 * Bones.Count];
        public Place HipsTranslation;

        public Rotation this[Bone bone]
        {
            get
            {
                Bones.Check(bone);
                fixed (float* first = rotations) return ((Rotation*)first)[(int)bone];
            }
            set
            {
                Bones.Check(bone);
                fixed (float* first = rotations) ((Rotation*)first)[(int)bone] = value;
            }
        }

        /// <summary>This pose with one bone turned.</summary>
        public Pose With(Bone bone, Rotation rotation)
        {
            var pose = this;
            pose[bone] = rotation;
            return pose;
        }
    }

    /// <summary>The bones of VRM 1.0 by kitsuke's numbers; parents come before their children.</summary>
    public enum Bone
    {
        Hips, Spine, Chest, UpperChest, Neck, Head, LeftEye, RightEye, Jaw, LeftUpperLeg, LeftLowerLeg, LeftFoot, LeftToes,
        RightUpperLeg, RightLowerLeg, RightFoot, RightToes, LeftShoulder, LeftUpperArm, LeftLowerArm, LeftHand, RightShoulder,
        RightUpperArm, RightLowerArm, RightHand, LeftThumbMetacarpal, LeftThumbProximal, LeftThumbDistal, LeftIndexProximal,
        LeftIndexIntermediate, LeftIndexDistal, LeftMiddleProximal, LeftMiddleIntermediate, LeftMiddleDistal, LeftRingProximal,
        LeftRingIntermediate, LeftRingDistal, LeftLittleProximal, LeftLittleIntermediate, LeftLittleDistal, RightThumbMetacarpal,
        RightThumbProximal, RightThumbDistal, RightIndexProximal, RightIndexIntermediate, RightIndexDistal, RightMiddleProximal,
        RightMiddleIntermediate, RightMiddleDistal, RightRingProximal, RightRingIntermediate, RightRingDistal,
        RightLittleProximal, RightLittleIntermediate, RightLittleDistal,
    }

    /// <summary>Bones and their VRM 1.0 names, for example <c>leftUpperArm</c>.</summary>
    public static unsafe class Bones
    {
        public const int Count = 55;

        public static string Name(Bone bone)
        {
            Check(bone);
            var buffer = stackalloc byte[64];
            return Encoding.UTF8.GetString(buffer, (int)Native.kitsuke_bone_name((uint)bone, buffer, (UIntPtr)64));
        }

        /// <summary>The bone that carries a bone in VRM 1.0, whose number is lower; null where none does.</summary>
        public static Bone? Parent(Bone bone)
        {
            Check(bone);
            var parent = Native.kitsuke_bone_parent((uint)bone);
            return parent < 0 ? (Bone?)null : (Bone)parent;
        }

        public static bool TryFind(string name, out Bone bone)
        {
            var bytes = Encoding.UTF8.GetBytes(name);
            fixed (byte* first = bytes) bone = (Bone)Native.kitsuke_bone_from_name(first, (UIntPtr)(uint)bytes.Length);
            return bone >= 0;
        }

        internal static void Check(Bone bone)
        {
            if ((uint)bone >= Count) throw new ArgumentOutOfRangeException(nameof(bone));
        }
    }
}
