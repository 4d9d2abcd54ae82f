// What all bindings share: status and exception, axes, and how texts come out of the library.

using System;
using System.Text;

namespace Kitsuke
{
    /// <summary>What became of a call.</summary>
    public enum Status
    {
        Ok = 0,
        /// <summary>A buffer is empty that must not be.</summary>
        Null = 1,
        /// <summary>A buffer is too short, or its offset or stride is no multiple of 4.</summary>
        Buffer = 2,
        /// <summary>A number names nothing: a vertex, frame, bone, text …</summary>
        Range = 3,
        /// <summary>A pack cannot be opened.</summary>
        Pack = 4,
        /// <summary>A recorded motion cannot be read.</summary>
        Motion = 5,
        /// <summary>A kimono cannot be fitted.</summary>
        Fit = 6,
        /// <summary>A bug of kitsuke; the handle that was used is to be disposed of.</summary>
        Panic = 7,
    }

    /// <summary>In which axes places and poses go in and come out.</summary>
    public enum Axes
    {
        /// <summary>glTF, VRM, Godot: right-handed, metres, Y up, front +Z, the wearer's left +X; outside is counter-clockwise.</summary>
        Gltf = 0,
        /// <summary>Unity: left-handed, metres, Y up, front +Z, left -X; outside is clockwise.</summary>
        Unity = 1,
        /// <summary>Unreal: left-handed, centimetres, Z up, front +Y, left +X; outside is clockwise.</summary>
        Unreal = 2,
    }

    /// <summary>A call that the library refused, in its words.</summary>
    public sealed class KitsukeException : Exception
    {
        public Status Status { get; }

        public KitsukeException(Status status, string message) : base(message)
        {
            Status = status;
        }
    }

    internal static unsafe class Call
    {
        /// Throws what the library says of a call that went wrong.
        internal static void Check(Status status)
        {
            if (status != Status.Ok) throw new KitsukeException(status, Message());
        }

        /// What this thread's last call had to say.
        internal static string Message()
        {
            var length = (int)Native.kitsuke_message(null, UIntPtr.Zero);
            var bytes = new byte[length + 1];
            fixed (byte* buffer = bytes) Native.kitsuke_message(buffer, (UIntPtr)(uint)bytes.Length);
            return Encoding.UTF8.GetString(bytes, 0, length);
        }

        /// Other declarations than the library's would read and write where nothing is.
        internal static void CheckAbi()
        {
            var abi = Native.kitsuke_abi_version();
            if (abi != Native.Abi)
                throw new KitsukeException(Status.Range, $"the native library has interface {abi}, these bindings are for {Native.Abi}");
        }
    }
}
