// The functions of `kitsuke.h`, one to one: blittable numbers and pointers, and handles that cannot be freed twice. Everything public
// stands in the other files. (`kitsuke_bytes_new` and `_free` are for WebAssembly without a host and have no place here.)

using System;
using System.Runtime.InteropServices;

namespace Kitsuke
{
    /// <summary>What the library made and gets back once: on Dispose, or when the garbage collector finds it.</summary>
    public abstract class Handle : SafeHandle
    {
        internal Handle() : base(IntPtr.Zero, true) { }

        /// <summary>True where the library gave nothing.</summary>
        public override bool IsInvalid => handle == IntPtr.Zero;
    }

    /// <summary>Where the vectors of a vertex attribute go.</summary>
    [StructLayout(LayoutKind.Sequential)]
    internal unsafe struct Attribute
    {
        internal byte* Data;
        internal UIntPtr Bytes, Offset, Stride;

        internal Attribute(byte* data, int bytes, int offset = 0, int stride = 0)
        {
            Data = data;
            // A negative number becomes a huge one, which the library refuses.
            Bytes = (UIntPtr)(ulong)(uint)bytes;
            Offset = (UIntPtr)(ulong)(uint)offset;
            Stride = (UIntPtr)(ulong)(uint)stride;
        }
    }

    internal static unsafe class Native
    {
        /// Of the header that these declarations follow.
        internal const uint Abi = 2;

#if (UNITY_IOS || UNITY_TVOS || UNITY_VISIONOS || UNITY_WEBGL) && !UNITY_EDITOR
        // Linked into the app itself.
        private const string Library = "__Internal";
#else
        private const string Library = "kitsuke_ffi";
#endif

        [DllImport(Library)] internal static extern uint kitsuke_abi_version();
        [DllImport(Library)] internal static extern UIntPtr kitsuke_message(byte* buffer, UIntPtr capacity);

        [DllImport(Library)] internal static extern Status kitsuke_pack_open(byte* bytes, UIntPtr length, out IntPtr pack);
        [DllImport(Library)] internal static extern void kitsuke_pack_free(IntPtr pack);
        [DllImport(Library)] internal static extern Status kitsuke_pack_info(Pack pack, PackInformation* info);
        [DllImport(Library)] internal static extern Status kitsuke_pack_text(Pack pack, Text text, uint index, byte* buffer, UIntPtr capacity, UIntPtr* length);
        [DllImport(Library)] internal static extern UIntPtr kitsuke_pack_index_count(Pack pack);
        [DllImport(Library)] internal static extern Status kitsuke_pack_indices(Pack pack, Axes axes, uint* indices, UIntPtr count);
        [DllImport(Library)] internal static extern Status kitsuke_pack_obi_indices(Pack pack, Axes axes, uint* indices, UIntPtr count);
        [DllImport(Library)] internal static extern Status kitsuke_pack_uv(Pack pack, Axes axes, Attribute uv);
        [DllImport(Library)] internal static extern Status kitsuke_pack_texture(Pack pack, byte* buffer, UIntPtr capacity);
        [DllImport(Library)] internal static extern Status kitsuke_pack_path_length(Pack pack, uint index, float* lengthM);
        [DllImport(Library)] internal static extern Status kitsuke_pack_joint(Pack pack, Axes axes, uint bone, float* place, int* parent);
        [DllImport(Library)] internal static extern Status kitsuke_pack_target_pose(Pack pack, Axes axes, uint target, Pose* pose);
        [DllImport(Library)] internal static extern Status kitsuke_limit(Pack pack, Axes axes, Pose* pose, Pose* limited, float* turnedRad);

        [DllImport(Library)] internal static extern uint kitsuke_bone_count();
        [DllImport(Library)] internal static extern UIntPtr kitsuke_bone_name(uint bone, byte* buffer, UIntPtr capacity);
        [DllImport(Library)] internal static extern int kitsuke_bone_parent(uint bone);
        [DllImport(Library)] internal static extern int kitsuke_bone_from_name(byte* name, UIntPtr length);

        [DllImport(Library)] internal static extern Status kitsuke_evaluator_new(Pack pack, Axes axes, out IntPtr evaluator);
        [DllImport(Library)] internal static extern void kitsuke_evaluator_free(IntPtr evaluator);
        [DllImport(Library)] internal static extern Status kitsuke_evaluate(Evaluator evaluator, Pose* pose, Attribute* positions, Attribute* normals);
        [DllImport(Library)] internal static extern Status kitsuke_evaluate_obi(Evaluator evaluator, Pose* pose, Attribute* positions, Attribute* normals);

        [DllImport(Library)] internal static extern Status kitsuke_motion_open(byte* bytes, UIntPtr length, Pack pack, out IntPtr motion);
        [DllImport(Library)] internal static extern void kitsuke_motion_free(IntPtr motion);
        [DllImport(Library)] internal static extern Status kitsuke_motion_info(Motion motion, MotionInformation* info);
        [DllImport(Library)] internal static extern UIntPtr kitsuke_motion_note(Motion motion, uint index, byte* buffer, UIntPtr capacity);
        [DllImport(Library)] internal static extern Status kitsuke_motion_pose(Motion motion, uint frame, Axes axes, Pose* pose, float* confidence);
        [DllImport(Library)] internal static extern Status kitsuke_motion_pose_at(Motion motion, double timeS, Axes axes, Pose* pose);

        [DllImport(Library)] internal static extern Status kitsuke_receiver_new(Pack pack, out IntPtr receiver);
        [DllImport(Library)] internal static extern void kitsuke_receiver_free(IntPtr receiver);
        [DllImport(Library)] internal static extern Status kitsuke_receiver_datagram(Receiver receiver, byte* bytes, UIntPtr length, double nowS, uint* completed);
        [DllImport(Library)] internal static extern Status kitsuke_receiver_pose(Receiver receiver, double nowS, double staleAfterS, Axes axes, Pose* pose, float* confidence, double* ageS);
        [DllImport(Library)] internal static extern Status kitsuke_receiver_calibrate(Receiver receiver);

        [DllImport(Library)] internal static extern uint kitsuke_measurement_count();
        [DllImport(Library)] internal static extern UIntPtr kitsuke_measurement_name(uint measurement, byte* buffer, UIntPtr capacity);
        [DllImport(Library)] internal static extern int kitsuke_measurement_from_name(byte* name, UIntPtr length);
        [DllImport(Library)] internal static extern Status kitsuke_fitter_new(Pack pack, out IntPtr fitter);
        [DllImport(Library)] internal static extern void kitsuke_fitter_free(IntPtr fitter);
        [DllImport(Library)] internal static extern uint kitsuke_fitter_rule_set_count(Fitter fitter);
        [DllImport(Library)] internal static extern uint kitsuke_fitter_dimension_count(Fitter fitter);
        [DllImport(Library)] internal static extern UIntPtr kitsuke_fitter_text(Fitter fitter, uint dimension, uint index, byte* buffer, UIntPtr capacity);
        [DllImport(Library)] internal static extern Status kitsuke_fit(Fitter fitter, float* measurementsM, UIntPtr count, uint rules, FitInformation* info, IntPtr* fitted);
        [DllImport(Library)] internal static extern Status kitsuke_fitter_reach(Fitter fitter, uint dimension, Reach* reach);
    }
}
